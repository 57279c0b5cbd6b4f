"""Joints that share causes: one regression of all torque balances."""
