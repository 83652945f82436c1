"""Methods as their coefficients: tableaus, and their order by conditions on rooted trees."""

from ropeode.tableaus.nystrom import NystromTableau
from ropeode.tableaus.tableau import Tableau

__all__ = ["NystromTableau", "Tableau"]
