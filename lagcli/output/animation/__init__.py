"""Pictures that move: a scene of a model and a run, and the page, the film and the still made of it."""
