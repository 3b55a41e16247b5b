"""The formulas of the project as functions over arrays, with stated error bounds."""
