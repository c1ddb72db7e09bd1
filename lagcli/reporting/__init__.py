"""The page of a model: what it holds, and its files in HTML, Markdown and PDF.

In: a model, its verdicts, a trajectory and its audit
Out: `report_page.ReportPage`: one page, or files

The text of the page stands in `templates`; `loop_figure` draws the witness of a verdict.
"""
