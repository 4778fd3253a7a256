"""Ground floor: the types that every step speaks, their units and axes. numpy only."""
