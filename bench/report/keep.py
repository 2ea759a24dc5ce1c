"""Keeps a report in docs/benchmarks.md: its table at equal error, and its figures beside it."""
import shutil

import guard_map
import page

BEGIN = "<!-- by scripts/bench --keep -->"


def keep(report, directory, root):
    """Replaces what follows the mark in docs/benchmarks.md, and the figures docs/benchmarks-*.svg."""
    file = root / "docs/benchmarks.md"
    head = file.read_text().split(BEGIN)[0].rstrip() + "\n\n"
    for old in (root / "docs").glob("benchmarks-*.svg"):
        old.unlink()
    commit = report["machine"]["commit"]
    heading = page.heading(report).replace(commit, f"`{commit}`")
    text = [BEGIN, "## The report", heading, *page.remarks(report, None),
            "### At equal error", page.LEAD, page.markdown_table(*page.equal_error_table(report))]
    if report.get("map"):
        text += ["### Ways to check a guard", guard_map.LEAD, guard_map.remark(report["map"]),
                 page.markdown_table(*guard_map.table(report["map"]))]
    if report["pays"]:
        text += ["### What a scene pays for", page.PAYS,
                 page.markdown_table(*page.pays_table(report))]
    text.append("### Figures")
    shown = []
    for name, caption, _ in page.figures(report):
        figure = directory / f"{name}.svg"
        if figure.exists():
            shutil.copy(figure, root / f"docs/benchmarks-{name}.svg")
            shown.append(f"![{caption}](benchmarks-{name}.svg)")
    text.append("\n".join(shown))
    file.write_text(head + "\n\n".join(text) + "\n")
