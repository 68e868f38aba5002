"""Everything that can complete a clip, behind one small protocol."""
