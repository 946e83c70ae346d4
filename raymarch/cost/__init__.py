"""What accuracy costs in time: errors against the truth, settings measured, the front of those worth having."""
