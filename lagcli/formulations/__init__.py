"""One model in several formulations, run side by side.

`functions` evaluates a system without its multipliers, `chart` writes it in independent quantities (Maggi), `steps`
integrates it there, `reduced` makes a table of that, `comparison` tells to how many digits tables agree.
"""
