"""What every scene is made with: studio, shapes, paint, meshes that move, and the data set that comes out."""
