"""The documentation as a site: every link leads somewhere, and nothing is fetched from elsewhere."""

import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).parents[2]
CONFIG = ROOT / "docs" / "site" / "mkdocs.yml"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """The site. A warning of MkDocs, as of a link that leads nowhere, is an error."""
    pytest.importorskip("mkdocs")
    from mkdocs.commands import build
    from mkdocs.config import load_config

    folder = tmp_path_factory.mktemp("site")
    config = load_config(str(CONFIG), site_dir=str(folder), strict=True)
    config.plugins.on_startup(command="build", dirty=False)
    build.build(config)
    return folder


def test_every_page_is_on_the_site_and_in_its_menu(site: pathlib.Path) -> None:
    start = (site / "index.html").read_text(encoding="utf-8")
    for page in (ROOT / "docs").rglob("*.md"):
        if page != ROOT / "docs" / "README.md":
            address = page.relative_to(ROOT / "docs").with_suffix(".html").as_posix()
            assert (site / address).is_file()
            assert f'href="{address}" class="dropdown-item"' in start, address
    assert (site / "models" / "index.html").is_file()
    assert (site / "models" / "rolling-disk.yaml").is_file()


def test_pages_fetch_nothing_from_elsewhere(site: pathlib.Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        fetched = re.findall(r'<(?:script|img|iframe)[^>]*?src="([^"]+)"', text)
        fetched += re.findall(r'<link[^>]*?href="([^"]+)"', text)
        assert fetched
        assert not [address for address in fetched if re.match(r"(?:[a-z]+:)?//", address)], page.name


def test_the_scripts_of_the_theme_find_what_they_look_for(site: pathlib.Path) -> None:
    """Elements that it switches between light and dark, and headings whose names are selectors."""
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert 'id="hljs-light"' in text
        assert 'id="hljs-dark"' in text
        assert page.name == "404.html" or re.findall(r'(?:id="|href="#)\d[^"]*"', text) == [], page.name
    tutorial = (site / "tutorial.html").read_text(encoding="utf-8")
    assert 'id="part-1-a-pendulum"' in tutorial
    assert 'href="#part-1-a-pendulum"' in tutorial
