"""Behaviour trees as XML files of BehaviorTree.CPP and Groot: reader, interpreter, writer, and skills (S4.7, S4.18)."""
