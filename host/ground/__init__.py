"""Pages and programs that look at a sensor and steer it, by HTTP."""
