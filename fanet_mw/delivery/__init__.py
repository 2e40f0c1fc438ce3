"""End-to-end delivery of application messages: in pieces, exactly once, in order if asked for, with reports to the
sender.

    application -> Sender    message -> pieces -> packets of the node -> any routing protocol
    packets     -> Receiver  pieces -> message -> order of its flow -> application; receipts to the sender
    receipts    -> Sender    missing pieces are sent again; the application is told when all is acknowledged, or expired

A flow: the confirmed messages from one sender to the same nodes, on one port and of one priority. They are handed over
in the order of sending, past those given up; all others as they arrive.
"""
