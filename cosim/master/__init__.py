"""Runs a system: algorithms compile it into a plan, an execution goes through the plan."""
