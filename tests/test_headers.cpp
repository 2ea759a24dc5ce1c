// The headers that the test programs share, precompiled; see CMakeLists.txt.
