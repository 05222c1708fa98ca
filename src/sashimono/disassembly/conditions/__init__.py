"""What must be gone before each part can leave, and the orders that this allows."""
