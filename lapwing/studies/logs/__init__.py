"""What a log holds, where two logs differ, and a log as tables for other programs."""
