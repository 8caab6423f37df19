"""The commands of ``gcs``, one module each or for a group; ``registry`` lists them."""
