"""Figures of runs, results and audits, and charts of any columns: `chart` is what is drawn, the others draw it."""
