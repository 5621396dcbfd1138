"""Control of quadrotors that carry a load together."""
