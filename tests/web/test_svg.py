"""Pictures of matplotlib inside the page: ids, references and numbers."""

from dextron_bench.web import svg

DRAWN = """<?xml version="1.0"?>
<svg viewBox="0 0 9 9" width="9">
 <g id="axes_1"><path d="M 1.23456 2 L 3 4" clip-path="url(#{clip})"/><use xlink:href="#{mark}"/></g>
 <defs><clipPath id="{clip}"/><path id="{mark}"/></defs>
</svg>"""


def test_ids_are_numbered_and_references_follow() -> None:
    picture = svg.picture(DRAWN.format(clip="p1f", mark="m2e"), "curves", "label")
    assert '<g id="curves-0">' in picture
    assert 'clip-path="url(#curves-1)"' in picture
    assert '<clipPath id="curves-1"/>' in picture
    assert 'href="#curves-2"' in picture
    assert '<path id="curves-2"/>' in picture


def test_layouts_that_differ_in_last_bits_give_equal_pictures() -> None:
    other = DRAWN.format(clip="pa0", mark="mb1").replace("1.23456", "1.2345600000001")
    assert svg.picture(other, "curves", "label") == svg.picture(DRAWN.format(clip="p1f", mark="m2e"), "curves", "label")


def test_the_picture_has_a_label_and_the_view_box_alone() -> None:
    picture = svg.picture(DRAWN, "curves", "Learning curves")
    assert picture.startswith('<svg role="img" aria-label="Learning curves" focusable="false" viewBox="0 0 9 9">')
