"""Whatever can be a row of a table: it learns from demonstrations, and drives."""
