"""The page of `lagcli report`: what it holds, and its files in HTML, Markdown and PDF."""
