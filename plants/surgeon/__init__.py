"""What the surgeon does: tools in hands, recordings, tremor."""
