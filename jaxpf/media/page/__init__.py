"""A page in the browser that draws start shapes on a film and shows finished tracks."""
