"""One form by itself: Frobenius's test, and its integral by hook and crook."""
