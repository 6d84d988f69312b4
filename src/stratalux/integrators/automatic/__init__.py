"""``direct_stratified`` by itself: the estimator that needs no tuning."""
