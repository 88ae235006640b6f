"""Hooks of MkDocs for the documentation site.

Pages link to files outside docs/, as they do in the repository: the site includes those files. The build fails if a
public name has no docstring, if a link of the finished site is broken, or if a page loads a file from another host.
"""

from __future__ import annotations

import logging
import posixpath
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import griffe
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

log = logging.getLogger("mkdocs.hooks.dextron_bench")  # Strict mode counts the warnings of this logger.

FENCED = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"""(\]\(|\b(?:href|src)=")([^)"\s#:]+)""")  # To a file, in Markdown or in HTML.
LANGUAGES = {".py": "python", ".xml": "xml", ".toml": "toml", ".cff": "yaml"}  # Files that become pages.
LOADING = {"img": "src", "script": "src", "iframe": "src", "source": "src", "video": "src", "link": "href"}
REFERENCE = re.compile(r"^::: (\S+)", re.MULTILINE)
PACKAGE = "dextron_bench"
UNSEARCHED = "---\nsearch: {exclude: true}\n---\n"


def on_pre_build(config: MkDocsConfig) -> None:
    """Warns of public names that no page of the reference shows, and of shown ones that lack a docstring."""
    docs = Path(config.docs_dir)
    pages = (docs / "reference").glob("*.md")
    shown = [name for page in sorted(pages) for name in REFERENCE.findall(page.read_text(encoding="utf-8"))]
    package = griffe.load(PACKAGE, search_paths=[docs.parent])
    for name in package.exports or []:
        if f"{PACKAGE}.{name}" not in shown and name != "__version__":
            log.warning("no page of the reference shows %s.%s", PACKAGE, name)
    for name in shown:
        try:
            missing = list(undocumented(package[name.removeprefix(f"{PACKAGE}.")]))
        except (KeyError, griffe.AliasResolutionError):
            log.warning("the reference shows %s, which does not exist", name)
            continue
        for path in missing:
            log.warning("%s has no docstring", path)


def undocumented(thing: griffe.Object | griffe.Alias) -> Iterator[str]:
    """Paths of what is public in a module, class or function and has no docstring.

    Variables and fields need none. A property needs none if the docstring of its class names it.
    """
    owner = thing.parent.docstring if thing.parent and thing.parent.is_class else None
    if thing.is_attribute and ("property" not in thing.labels or (owner and f"`{thing.name}`" in owner.value)):
        return
    if not thing.has_docstring:
        yield thing.path
    if thing.is_module or thing.is_class:
        for name, member in thing.members.items():
            if not name.startswith("_") and not member.is_alias:
                yield from undocumented(member)


class Comments(griffe.Extension):
    """Shows the comment behind a variable or field as its docstring: `offset_x: float  # [m]`."""

    def on_attribute(self, *, attr: griffe.Attribute, **_: object) -> None:
        """Called for each variable and field that has been read."""
        if attr.docstring is None and "property" not in attr.labels:
            code, _, comment = attr.source.splitlines()[-1].rpartition("  # ")
            if code:
                attr.docstring = griffe.Docstring(comment, parent=attr)


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Adds the files outside docs/ that pages link to, and the files that those link to in turn."""
    docs = Path(config.docs_dir)
    sources = [(Path(file.abs_src_path or ""), file.content_string) for file in files.documentation_pages()]
    while sources:
        source, text = sources.pop()
        for target in linked_files(source, text):
            if target.is_relative_to(docs) or not target.is_relative_to(docs.parent):
                continue
            uri = site_uri(target, docs)
            if files.get_file_from_path(uri):
                continue
            content = page_of(target)
            if content is None:
                files.append(File.generated(config, uri, abs_src_path=str(target)))
            else:
                files.append(File.generated(config, uri, content=redirected(content, target, uri, docs)))
            if content or target.suffix == ".html":
                sources.append((target, content or target.read_text(encoding="utf-8")))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Directs links that lead out of docs/ to the included files."""
    if page.file.generated_by:
        return markdown  # Its links were redirected when it was included.
    return redirected(markdown, Path(page.file.abs_src_path or ""), page.file.src_uri, Path(config.docs_dir))


def linked_files(source: Path, text: str) -> Iterator[Path]:
    """The existing files and folders that a page's text links to by relative links."""
    for part in FENCED.split(text)[::2]:
        for _, link in LINK.findall(part):
            target = (source.parent / unquote(link)).resolve()
            if target.exists():
                yield target


def redirected(text: str, source: Path, uri: str, docs: Path) -> str:
    """A page's text with its links to existing files leading to their places on the site."""

    def redirect(match: re.Match[str]) -> str:
        target = (source.parent / unquote(match[2])).resolve()
        if not target.exists() or not target.is_relative_to(docs.parent):
            return match[0]  # MkDocs warns of it.
        return match[1] + posixpath.relpath(site_uri(target, docs), posixpath.dirname(uri))

    parts = FENCED.split(text)
    parts[::2] = [LINK.sub(redirect, part) for part in parts[::2]]
    return "".join(parts)


def site_uri(target: Path, docs: Path) -> str:
    """The path of a file among the site's sources; files outside docs/ are below `repository/`."""
    if target.is_relative_to(docs):
        return target.relative_to(docs).as_posix()
    path = target.relative_to(docs.parent).as_posix()
    if target.is_dir() or target.suffix in LANGUAGES:
        path += ".md"
    return "repository/" + path.replace("README.md", "readme.md")  # MkDocs makes an index.html of a README.md.


def page_of(target: Path) -> str | None:
    """The text of the page that shows a file or folder; None for a file that is not a page."""
    if target.suffix == ".md":
        return target.read_text(encoding="utf-8")
    if target.suffix in LANGUAGES:
        code = target.read_text(encoding="utf-8")
        return f"{UNSEARCHED}# {target.name}\n\n```{LANGUAGES[target.suffix]}\n{code}```\n"
    if target.is_dir():
        entries = [entry for entry in sorted(target.iterdir()) if entry.suffix in (".md", *LANGUAGES)]
        items = [f"- [`{entry.name}`]({target.name}/{entry.name})" for entry in entries if entry.stat().st_size]
        return "\n".join([f"{UNSEARCHED}# {target.name}", "", *items, ""])
    return None


class Links(HTMLParser):
    """Collects the anchors of a page, the links that a reader follows, and the files that a browser loads."""

    def __init__(self, text: str) -> None:
        """Reads the page's HTML."""
        super().__init__()
        self.anchors: set[str] = {"", "top"}
        self.followed: set[str] = set()
        self.loaded: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Called for each tag."""
        values = {name: value or "" for name, value in attrs}
        self.anchors |= {values.get("id", ""), values.get("name", "")}
        if tag == "a" and "href" in values:
            self.followed.add(values["href"])
        if tag in LOADING and values.get("rel") not in ("canonical", "next", "prev"):
            self.loaded.add(values.get(LOADING[tag], ""))


def on_post_build(config: MkDocsConfig) -> None:
    """Warns of broken links in the finished pages, and of files that they load from another host."""
    site = Path(config.site_dir)
    base = urlsplit(config.site_url or "").path or "/"
    pages = {file: Links(file.read_text(encoding="utf-8")) for file in sorted(site.rglob("*.html"))}
    for file, page in pages.items():
        for address in sorted(page.followed | page.loaded):
            link = urlsplit(address)
            if link.scheme or link.netloc:
                if address in page.loaded and link.scheme != "data":
                    log.warning("%s loads %s from another host", file.relative_to(site), address)
                continue
            path = unquote(link.path)
            target = site / path.removeprefix(base) if path.startswith("/") else file.parent / path
            target = (target if path else file).resolve()
            anchors = pages[target].anchors if target in pages else set()
            if not target.is_file() or (target in pages and unquote(link.fragment) not in anchors):
                log.warning("%s has a broken link: %s", file.relative_to(site), address)
