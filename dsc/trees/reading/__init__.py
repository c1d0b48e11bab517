"""Reader of XML files of BehaviorTree.CPP and Groot, formats 3 and 4."""
