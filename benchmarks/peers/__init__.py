"""Other engines on the workloads, each through its usual interface."""
