"""What an author claims of a stepper or a program, checked."""

from __future__ import annotations

import dataclasses

from ropeode.checking.report import Claims
from ropeode.steppers import as_stepper
from ropeode.validation import bad_value, check_whole


def checked_claims(claims: Claims) -> Claims:
    """The same claims, with the method's full name.

    Raises:
        InputError: an order is no whole number from 1 on, there is no such method, both are
            given, or an order with damping is given alone.
    """
    order, method, damped = claims.order, claims.method, claims.damped_order
    if order is not None:
        order = check_whole("expected_order", order, at_least=1, example="2")
    if damped is not None:
        damped = check_whole("damped_order", damped, at_least=1, example="1")
        if order is None:
            raise bad_value("damped_order", damped, "one beside an order", "claim that order, too")
    if order is not None and method is not None:
        allowed = "none beside a method, which has its own"
        raise bad_value("expected_order", order, allowed, "drop one")
    method = None if method is None else as_stepper(method).label
    return dataclasses.replace(claims, order=order, method=method, damped_order=damped)
