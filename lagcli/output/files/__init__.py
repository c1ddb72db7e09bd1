"""Files that leave the program: their endings, and that they are complete or not there."""
