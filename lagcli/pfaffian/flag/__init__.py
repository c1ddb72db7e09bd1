"""Forms together: what holonomic rows eliminate, the derived flag, and the joint verdict."""
