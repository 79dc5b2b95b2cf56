"""Plant faults one at a time and run the tests that reach them: do they notice?"""
