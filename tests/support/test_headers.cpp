// Nothing: its target compiles the headers that all tests begin with (tests/CMakeLists.txt).
