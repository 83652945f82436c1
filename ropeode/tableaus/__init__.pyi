from .nystrom import NystromTableau as NystromTableau
from .tableau import Tableau as Tableau
