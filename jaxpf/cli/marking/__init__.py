"""``jaxpf mark`` and ``jaxpf view``: draw start shapes, and review tracks, in the browser."""
