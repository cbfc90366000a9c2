"""Commands of ``joshua`` that this plugin brings."""
