// Only there to carry the precompiled headers of the tests.
