"""Reading and writing files: assemblies in, plans out."""
