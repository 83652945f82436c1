"""Dormand and Prince's methods of high order, at constant step."""

from __future__ import annotations

from ropeode.steppers.runge_kutta import RungeKutta
from ropeode.steppers.runge_kutta_methods import tableau_of
from ropeode.tableaus import Tableau


class DormandPrince5(RungeKutta):
    """The six slopes of order 5 of the pair that is known as DOPRI5 and ode45.

    A seventh, which only estimates the error, is left out: the step is constant.

    Source: J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6 (1980); Hairer, Norsett, Wanner,
    Solving Ordinary Differential Equations I, table II.5.2.
    """

    name = "dormand-prince5"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, table II.5.2"
    tableau = tableau_of(
        """| 1/5
        | 3/40 9/40
        | 44/45 -56/15 32/9
        | 19372/6561 -25360/2187 64448/6561 -212/729
        | 9017/3168 -355/33 46732/5247 49/176 -5103/18656""",
        "35/384 0 500/1113 125/192 -2187/6784 11/84",
    )
    tableau_order = 5


# The rows of the matrix, and the weights.
_OF_ORDER_8 = """
| 0.05260015195876773
| 0.0197250569845379 0.0591751709536137
| 0.02958758547680685 0 0.08876275643042054
| 0.2413651341592667 0 -0.8845494793282861 0.924834003261792
| 0.037037037037037035 0 0 0.17082860872947386 0.12546768756682242
| 0.037109375 0 0 0.17025221101954405 0.06021653898045596 -0.017578125
| 0.03709200011850479 0 0 0.17038392571223998 0.10726203044637328 -0.015319437748624402
  0.008273789163814023
| 0.6241109587160757 0 0 -3.3608926294469414 -0.868219346841726 27.59209969944671
  20.154067550477894 -43.48988418106996
| 0.47766253643826434 0 0 -2.4881146199716677 -0.590290826836843 21.230051448181193
  15.279233632882423 -33.28821096898486 -0.020331201708508627
| -0.9371424300859873 0 0 5.186372428844064 1.0914373489967295 -8.149787010746927
  -18.52006565999696 22.739487099350505 2.4936055526796523 -3.0467644718982196
| 2.273310147516538 0 0 -10.53449546673725 -2.0008720582248625 -17.9589318631188
  27.94888452941996 -2.8589982771350235 -8.87285693353063 12.360567175794303
  0.6433927460157636
| 0.054293734116568765 0 0 0 0 4.450312892752409 1.8915178993145003 -5.801203960010585
  0.3111643669578199 -0.1521609496625161 0.20136540080403034 0.04471061572777259
"""
_ROWS = [
    [0 if entry == "0" else float(entry) for entry in row.split()] for row in _OF_ORDER_8.split("|")
]


class DormandPrince8(RungeKutta):
    """The twelve slopes of order 8 of the program DOP853, without those that estimate its error.

    Source: P. J. Prince, J. R. Dormand, J. Comput. Appl. Math. 7 (1981); the coefficients are those
    of E. Hairer's program dop853.f: Hairer, Norsett, Wanner, Solving Ordinary Differential
    Equations I, section II.5.
    """

    name = "dormand-prince8"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, section II.5"
    tableau = Tableau.of(_ROWS[:-1], _ROWS[-1])
    tableau_order = 8
