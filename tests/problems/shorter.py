"""Parameters of library problems with which explicit steppers get through with few steps.

So short that step sizes of a fortieth of a frame are in the asymptotic range where the problem is
stiff or wild at its default length.
"""

SHORTER = {
    "arenstorf": {"periods": 0.003},
    "henon-heiles": {"duration": 4},
    "hires": {"duration": 1},
    "lorenz": {"duration": 0.5},
    "oregonator": {"duration": 0.05},
    "pleiades": {"duration": 1.2},
    "robertson": {"duration": 0.04},
    "van-der-pol": {"duration": 1, "epsilon": 0.5},
}
