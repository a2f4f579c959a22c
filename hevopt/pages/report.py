"""The page of a file of results: a saved comparison, or the store of a sweep; or of a folder of comparisons."""

from pathlib import Path

from hevopt.files.lookup import starts_with
from hevopt.files.writing import check_outs, write_whole

_SQLITE = b"SQLite format 3\0"


def report(file: str | Path, out: str | Path) -> Path:
    """Write the page of saved results, or of a sweep's store, also of one that still runs; the page's file.

    file: what `compare_and_report` or `hevopt compare --save` saved, or a store, or a folder of saved comparisons;
    out: the HTML file
    Raises DataError where the file is neither, or damaged, or the page cannot be written.
    """
    path = Path(out)
    page, inputs = page_of(Path(file))
    check_outs({"the page": path}, [file, *inputs])
    write_whole(path, page.encode())
    return path


def page_of(file: Path) -> tuple[str, list[str]]:
    """The page of a saved comparison, of a sweep (an SQLite database) or of a folder; the files behind it."""
    if file.is_dir():
        from hevopt.pages.folder.page import folder_page

        page, files = folder_page(file)
        return page, [str(path) for path in files]
    if starts_with(file, _SQLITE):
        from hevopt.pages.sweep.data import load_sweep
        from hevopt.pages.sweep.page import sweep_page

        sweep = load_sweep(file)
        return sweep_page(sweep), list(sweep.inputs)
    from hevopt.pages.comparison.page import comparison_page
    from hevopt.pages.comparison.saved import load_results

    results = load_results(file)
    return comparison_page(results), list(results.inputs)
