"""End-to-end delivery of application messages: in pieces, exactly once, in order if asked for, with reports to the
sender.

    application -> Sender    message -> pieces -> packets of the node -> any routing protocol
    packets     -> Receiver  pieces -> message -> order of its flow -> application; receipts to the sender
    receipts    -> Sender    missing pieces are sent again; the application is told when all is acknowledged, or expired

A flow consists of the confirmed messages from one sender to the same nodes, on one port and of one priority. They are
handed over in the order in which they were sent; one that the sender has given up is skipped. All other messages are
handed over as they arrive. Memory is bounded on both sides. Like the rest of the core, this package is sans-IO.
"""
