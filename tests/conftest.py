"""What holds for every test."""

import signal

# A shell that starts the tests in the background makes them deaf to Ctrl-C, and every command that they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
