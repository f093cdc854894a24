"""A rider on a bicycle: multibody, tyres, balance, contact forces, sensors and the environment."""
