"""Every calculator has a notebook, and every notebook runs against the real service."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nbclient
import nbformat
import pytest

import precut

FOLDER = Path(__file__).parents[1] / "notebooks"
AT_ONCE = 2


@pytest.fixture(scope="module")
def books(url, tmp_path_factory):
    """All notebooks by name, run; a fault in place of one that does not."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PRECUT_URL", url)
        folder = tmp_path_factory.mktemp("notebooks")

        def run(path: Path):
            book = nbformat.read(path, as_version=4)
            try:
                return nbclient.NotebookClient(book, timeout=120, resources={"metadata": {"path": folder}}).execute()
            except nbclient.exceptions.CellExecutionError as fault:
                return fault

        paths = sorted(FOLDER.glob("*.ipynb"))
        with ThreadPoolExecutor(AT_ONCE) as pool:
            return dict(zip((path.stem for path in paths), pool.map(run, paths), strict=True))


def test_every_calculator_has_a_notebook(url, books):
    assert set(books) == {calculator.id for calculator in precut.Client(url).calculators()} | {"studies"}


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.ipynb")))
def test_a_notebook_runs_and_shows_figure_and_table(books, name):
    book = books[name]
    if isinstance(book, Exception):
        raise book
    shown = [output["data"] for cell in book.cells for output in cell.get("outputs", []) if "data" in output]
    assert any("image/svg+xml" in data for data in shown), "no figure"
    assert any("<table" in data.get("text/html", "") for data in shown), "no table"


def test_notebooks_are_kept_without_what_they_print():
    for path in FOLDER.glob("*.ipynb"):
        for cell in nbformat.read(path, as_version=4).cells:
            assert not cell.get("outputs") and not cell.get("execution_count"), path.name
