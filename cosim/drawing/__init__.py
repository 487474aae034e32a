"""Pictures of systems: a layered drawing of boxes and wires, as SVG."""
