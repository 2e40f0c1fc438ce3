"""Messages of applications from end to end: in pieces, once, in order where that is asked for, and their fate is told.

    application -> Sender    pieces of a message -> packets of the node -> any routing protocol
    packets     -> Receiver  pieces put together -> in order of the flow -> application, and receipts to the sender
    receipts    -> Sender    what is missing is sent again; acknowledged, or expired, is told to the application

Order: messages that are to be confirmed, of one sender to the same nodes, on one port and of one priority, are handed
over in the order in which they were sent; one that its sender has given up is passed over. Others are handed over as
they come. Memory has a bound on both sides. Sans-IO, as all of the core.
"""
