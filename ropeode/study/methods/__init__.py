"""Methods at a ladder of efforts: steppers by their step size, adaptive solvers by a tolerance."""
