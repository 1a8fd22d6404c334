"""Networks: members that push each other, proved one by one."""
