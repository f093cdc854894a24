"""One PyBullet client: bodies, joints, exact states, generated multibody descriptions."""
