from hypothesis import settings

# A slow moment of the machine is not a failure.
settings.register_profile("dynhull", deadline=None, print_blob=True)
settings.load_profile("dynhull")
