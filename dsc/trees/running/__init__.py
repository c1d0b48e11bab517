"""The interpreter of behaviour trees: one class for each kind of node, by the rules of BehaviorTree.CPP, version 4."""
