"""What an object is: shapes and inertia."""
