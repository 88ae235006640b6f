"""The leaderboard's page in a browser: it shows the numbers of the table, for any names of methods.

Long, because one browser and one table serve all tests of the page.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.evaluation.results import Result
from dextron_bench.leaderboard import page as leaderboard_page
from dextron_bench.leaderboard import round_table
from dextron_bench.scores import standings
from dextron_bench.splits.loading import load_split
from dextron_bench.splits.tracks import PLUS
from dextron_bench.web.html import UNKNOWN
from tests.helpers import results
from tests.helpers.browser import visit

BOARD = Path(__file__).parents[3] / "leaderboard"
PUBLISHED = (BOARD / leaderboard_page.FILE).as_uri()
ALL = f"{PUBLISHED}#reaches=&split="  # Without the filter that the page starts with.
EVIL = "<script>alert(1)</script>", """"><img src=x onerror=alert(1)>'&amp; $x$ ]]>"""
RANKED = pd.DataFrame(
    [
        ["minjerk", EVIL[0], 1.0, "", 0.75, 0.7, 0.8, 0.9, 0.8, 0.75, 0.7, [0.01, -0.02], 2, 3, 0.05],
        ["minjerk", EVIL[1], float("nan"), "a ceiling", 0.5, 0.4, 0.6, 0.9, 0.6, float("nan"), 0.4, [], 1, 3, 0.05],
    ],
    columns=[*round_table.COLUMNS],
)
Table = dict[tuple[str, str, str], dict[str, Any]]  # Rows by method, source of reaches and split.
NAMES = "method", "success", "frames"


@pytest.fixture(scope="module")
def table() -> Table:
    return pd.read_csv(BOARD / "table.csv").set_index(["method", "reaches", "split"]).to_dict("index")  # type: ignore[return-value]


@pytest.fixture
def evil(tmp_path: Path) -> str:
    """The address of a page whose names of methods and machines contain HTML and scripts."""
    rows = standings.table([*map(result, EVIL)]).assign(iqm=[19.5, 18.25], regret=[0.5, 1.75])
    points = pd.DataFrame({"epoch": [10, 20], "return": [1.0, 2.0]})
    curves = {"minjerk": {method: {0: points} for method in EVIL}}
    file = tmp_path / leaderboard_page.FILE
    file.write_text(leaderboard_page.document(rows, RANKED, map(result, EVIL), curves, tmp_path, {}), encoding="utf-8")
    return file.as_uri()


def result(method: str) -> Result:
    split = load_split("minjerk", "test")
    scores = [20.0] * 150 + [0.0] * 50
    split_result = {"digest": split.digest, "scores": scores, "failed": 0, "closing_lag": 0.1}
    training = {"label": method + "!", "frames": 1000, "demonstrations": 12_345, "seconds": 5400.0}
    return results.result(
        method,
        reaches="minjerk",
        splits={"test": {**split_result, "causes": {"solved": 150, "slipped": 50}}},
        tier="re-run",
        privileged=method,
        provenance={"machine": {"cpu": method, "cores": 2}},
        training=training,
    )


def shown(page: Any) -> list[str]:
    """The methods of the visible rows, from the top."""
    return page.eval_on_selector_all(
        "#standings tbody tr",
        "rows => rows.filter(r => r.checkVisibility()).map(r => r.querySelector('.name').innerText)",
    )


def cells(page: Any) -> list[dict[str, Any]]:
    """The cells of every row, by column: the text, and the value for sorting."""
    return page.eval_on_selector_all(
        "#standings tbody tr",
        """rows => rows.map(row => Object.fromEntries([...row.cells].map(
            cell => [cell.dataset.name, [cell.textContent, cell.dataset.value]])))""",
    )


def values(page: Any, column: str) -> list[float | None]:
    """The numbers of a column, with which the visible rows are sorted; None if a row has none."""
    return page.eval_on_selector_all(
        "#standings tbody tr",
        """(rows, column) => rows.filter(row => row.checkVisibility()).map(row => {
            const value = row.querySelector(`[data-name=${column}]`).dataset.value;
            return value ? Number(value) : null;
        })""",
        column,
    )


@pytest.mark.slow
def test_every_number_equals_the_published_table(browser: Any, table: Table):
    with visit(browser, ALL) as opened:
        rows = cells(opened)
    assert len(rows) == len(table) + 1
    quoted = [row for row in rows if row["tier"][0] == "quoted"]
    assert [(row["return"][0], row["success"][0].strip()) for row in quoted] == [("15.00 ", "75.0")]
    for row in rows:
        if row["tier"][0] == "quoted":
            continue
        name = row["method"][0].partition("ceiling")[0].partition("floor")[0].partition("policy of")[0]
        expected = table[name, row["reaches"][0], row["split"][0]]
        assert float(row["return"][1]) == pytest.approx(expected["return"], rel=1e-5)
        interval = f"{expected['return']:.2f} [{expected['return_low']:.2f}, {expected['return_high']:.2f}]"
        assert row["return"][0] == interval
        rates = [f"{100 * expected[f'success{end}']:.1f}" for end in ("", "_low", "_high")]
        assert row["success"][0] == f"{rates[0]} [{rates[1]}, {rates[2]}]"
        assert row["seeds"][0] == str(expected["seeds"])


@pytest.mark.slow
def test_endings_equal_the_published_table(browser: Any, table: Table):
    with visit(browser, ALL) as opened:
        parts = opened.eval_on_selector_all(
            "[data-split]:has(.endings)",
            """parts => parts.map(part => [part.dataset.reaches, part.dataset.split,
                [...part.querySelectorAll("tbody tr")].map(row => [...row.cells].map(
                    cell => cell.querySelector("svg") ? "" : cell.innerText))])""",
        )
    plain = {key[1:] for key in table if key[0] != "exp" and PLUS not in key[2]}
    assert {(reaches, split) for reaches, split, _ in parts} == plain
    for reaches, split, rows in parts:
        for method, _, *shares, lag in rows:
            expected = table[method, reaches, split]
            assert shares == [f"{100 * expected[cause] / expected['episodes']:.1f}" for cause in CAUSES]
            assert lag in (f"{expected['closing_lag']:.2f}", "\N{EN DASH}")


@pytest.mark.slow
def test_heat_maps_average_to_the_success_of_the_row(browser: Any, table: Table):
    with visit(browser, f"{PUBLISHED}#reaches=real&split=test") as opened:
        for heat in opened.locator(".heat:has(tfoot)").locator("visible=true").all():  # Tracks have no settings.
            rows = heat.evaluate(
                """table => [...table.rows].map(row => [row.cells[0].innerText, ...[...row.querySelectorAll("td")].map(
                    cell => [cell.dataset.value ?? null, cell.innerText])])"""
            )
            settings = [int(text) for _, text in rows[-1][1:]]
            assert sum(settings) == 500
            for method, *of_method in [row for row in rows[:-1] if len(row) > 1]:
                rates = [float(value or 0.0) for value, _ in of_method]
                mean = sum(rate * count for rate, count in zip(rates, settings, strict=True)) / 500
                assert mean == pytest.approx(table[method, "real", "test"]["success"], abs=1e-4)


@pytest.mark.slow
def test_the_page_starts_with_test_of_real_and_filters(browser: Any, table: Table):
    best = [name for name, *rest in table if rest == ["real", "test"]]
    with visit(browser, PUBLISHED) as opened:
        assert shown(opened) == [*best, "RLIL 0.1"]
        assert opened.locator("#count").inner_text() == f"{len(best)} of {len(table)} rows, 1 quoted"
        opened.select_option("[name=tier]", "quoted")
        assert shown(opened) == ["RLIL 0.1"]
        opened.select_option("[name=tier]", "")
        opened.fill("[name=text]", "SOR")
        assert shown(opened) == [name for name in best if "sor" in name] != []
        assert opened.locator("#count").inner_text().endswith(f"of {len(table)} rows")
        opened.fill("[name=text]", "")
        opened.select_option("[name=split]", "val")
        assert shown(opened) == ["exp"]
        assert opened.locator("section:has(#how-episodes-end) .nothing").is_visible()
        opened.reload()  # The address keeps the choice.
        assert shown(opened) == ["exp"]
        opened.select_option("[name=reaches]", "minjerk")
        assert shown(opened) == []
        opened.select_option("[name=split]", "test")
        assert shown(opened) == [name for name, *rest in table if rest == ["minjerk", "test"]] != []
        assert not opened.locator("section:has(#how-episodes-end) .nothing").is_visible()
        assert opened.locator("figure[data-reaches]").locator("visible=true").count() == 1


@pytest.mark.slow
def test_headings_sort_by_click_and_by_key_and_announce_it(browser: Any):
    with visit(browser, PUBLISHED) as opened:
        headings = {name: opened.locator(f"#standings th[scope=col][data-name={name}]") for name in NAMES}
        heading = headings["success"]
        heading.get_by_role("button").click()
        assert heading.get_attribute("aria-sort") == "descending"
        assert shown(opened)[0] == "exp"
        successes = [success for success in values(opened, "success") if success is not None]
        assert successes == sorted(successes, reverse=True)
        assert len(successes) == len(shown(opened))
        opened.keyboard.press("Enter")  # The button has the focus.
        assert heading.get_attribute("aria-sort") == "ascending"
        assert shown(opened)[-1] == "exp"
        assert "by success, ascending" in opened.locator("#count").inner_text()
        headings["frames"].get_by_role("button").press("Space")
        assert heading.get_attribute("aria-sort") == "none"
        known = [frames for frames in values(opened, "frames") if frames is not None]
        assert known == sorted(known, reverse=True)
        assert 750_000 in known  # The quoted row.
        assert values(opened, "frames") == [*known, *[None] * (len(shown(opened)) - len(known))]  # Unknown: last.
        headings["method"].get_by_role("button").click()
        assert shown(opened) == sorted(shown(opened), key=str.lower)


@pytest.mark.slow
def test_the_keyboard_reaches_everything(browser: Any):
    with visit(browser, PUBLISHED) as opened:
        reached = []
        for _ in range(12):
            opened.keyboard.press("Tab")
            reached.append(opened.evaluate("document.activeElement.name || document.activeElement.innerText"))
        assert reached[:5] == ["Skip to the table", "reaches", "split", "tier", "text"]
        assert "method" in reached
        unnamed = opened.eval_on_selector_all(
            "[tabindex], a, button, select, input",
            """elements => elements.filter(e => e.checkVisibility() && !(e.ariaLabel || e.innerText
                || e.labels?.length || e.getAttribute("aria-labelledby")))""",
        )
        assert unnamed == []


@pytest.mark.slow
def test_the_page_is_readable_without_its_script(browser: Any, table: Table):
    with visit(browser, PUBLISHED, java_script_enabled=False) as opened:
        assert opened.locator("#standings tbody tr").locator("visible=true").count() == len(table) + 1
        assert not opened.locator(".controls").is_visible()
        assert opened.locator("figure svg").locator("visible=true").count() == 4


@pytest.mark.slow
def test_each_table_has_a_caption_and_each_picture_a_name(browser: Any):
    with visit(browser, ALL) as opened:
        assert opened.evaluate("[...document.querySelectorAll('table')].every(t => t.caption?.textContent)")
        assert opened.evaluate("[...document.querySelectorAll('th')].every(h => h.scope)")
        svgs = "[...document.querySelectorAll('svg')].every(s => s.ariaHidden === 'true' || s.ariaLabel)"
        assert opened.evaluate(svgs)
        ids = opened.evaluate("[...document.querySelectorAll('[id]')].map(e => e.id)")
        assert len(ids) == len(set(ids))


@pytest.mark.slow
def test_names_of_strangers_are_text_everywhere(browser: Any, evil: str):
    with visit(browser, f"{evil}#reaches=&split=") as opened:
        opened.on("dialog", lambda dialog: pytest.fail(dialog.message))
        assert shown(opened) == [*sorted(EVIL)]
        assert opened.evaluate("[document.scripts.length, document.images.length]") == [1, 0]
        for name in EVIL:  # In the ranks, the table, endings, heat map, and the curves.
            assert opened.get_by_text(name, exact=True).count() >= 5
        ranks = [text.split("\t") for text in opened.locator("table.ranks tbody tr").all_inner_texts()]
        assert ranks[0] == ["1", EVIL[0], "75.0 [70.0, 80.0]", "80.0", "75.0", "70.0", "90.0", "+1.0, -2.0", "2"]
        assert [text.strip() for text in ranks[1][:3]] == ["a ceiling", EVIL[1], "50.0 [40.0, 60.0]"]
        assert ranks[1][3:] == ["60.0", UNKNOWN, "40.0", "90.0", UNKNOWN, "1"]
        rows = cells(opened)
        assert [row["IQM"][0] for row in rows] == ["19.50", "18.25"]
        assert [row["regret"][0] for row in rows] == ["0.50", "1.75"]
        assert {(row["tier"][0], row["frames"][0], row["demos"][0]) for row in rows} == {("re-run", "1,000", "12,345")}
        assert rows[0]["wall time"][0] == f"1.5 h{sorted(EVIL)[0]}, 2 cores"
        assert rows[0]["privileged"][0] == sorted(EVIL)[0]


@pytest.mark.slow
def test_only_the_script_of_the_page_may_run(browser: Any, tmp_path: Path):
    """The browser would refuse a script in a name that was not escaped."""
    file = tmp_path / leaderboard_page.FILE
    file.write_text(
        (BOARD / leaderboard_page.FILE).read_text().replace("</main>", "<script>window.ran = 1</script></main>")
    )
    opened = browser.new_page()
    opened.goto(file.as_uri())
    assert opened.evaluate("window.ran") is None
    assert opened.locator("#count").inner_text()  # The page's own script did run.
    opened.close()


@pytest.mark.slow
def test_links_to_recordings_lead_to_shipped_files(browser: Any):
    with visit(browser, ALL) as opened:
        links = opened.eval_on_selector_all("a[href$='.rrd']", "links => links.map(a => a.getAttribute('href'))")
    files = {(BOARD / link).resolve() for link in links}
    assert {file.parent for file in files} == {BOARD.parent / "recordings"}
    assert files == set((BOARD.parent / "recordings").glob("*.rrd"))


@pytest.mark.slow
def test_equal_results_make_equal_pages(tmp_path: Path):
    rows = standings.table(map(result, EVIL))
    pages = {leaderboard_page.document(rows, RANKED, map(result, EVIL), {}, tmp_path, {}) for _ in range(2)}
    assert len(pages) == 1
