"""References between their samples: piecewise polynomials with an error bound of their own."""
