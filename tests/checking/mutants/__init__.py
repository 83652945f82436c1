"""Wrong steppers, and the right ones that they were made from."""
