"""Charts: any columns of any tables as curves; `chart` is what is drawn, the other files make it and draw it."""
