"""A first model: those of the gallery, and templates for one's own."""
