"""Elements of interface tables: fields, messages, frames, registers."""
