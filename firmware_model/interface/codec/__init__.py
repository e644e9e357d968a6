"""What interface tables are made of: fields, messages, frames, registers."""
