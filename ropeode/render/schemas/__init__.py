"""The JSON forms of results: their keys and types, from which docs/schemas is made.

A form is a TypedDict. Where one of its parts is just what a result holds, that dataclass stands for
the part, and its docstring describes the keys.
"""
