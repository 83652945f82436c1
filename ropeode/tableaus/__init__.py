"""Methods as their coefficients: tableaus, and their order by conditions on rooted trees."""
