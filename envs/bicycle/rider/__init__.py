"""The rider: anthropometry, posture, limbs, saddle contact and riding style."""
